"""What ordinary drives need besides registers: doubts about what is found, their own tuning, a first look at an unknown one."""
