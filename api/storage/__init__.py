"""What outlives the process: plans, jobs, answers given, who is alive; SQLite or PostgreSQL."""
