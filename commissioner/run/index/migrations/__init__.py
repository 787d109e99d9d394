"""The tables of a shared database, made and changed by alembic, whatever version of this program comes first."""
