"""Storage in SQLite or PostgreSQL: plans, jobs, answers given, and live processes."""
