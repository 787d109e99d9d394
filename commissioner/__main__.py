"""`python -m commissioner`: as the command."""

from commissioner.cli.app import main

if __name__ == "__main__":
    main()
