"""Who may do what: accounts, sessions, roles, and the gate that every request passes."""
