"""`commissioner serve`: HTTP API and the technician's page. One child process per run; the run folders are the truth."""
