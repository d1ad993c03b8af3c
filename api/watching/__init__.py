"""What a scrape reads of a running process, beside what it has counted.

readings_cache        a source that is read once a second, however often it is asked
job_readings          jobs that wait and run, and workers, from the database
pool_readings         child processes and their tasks
connection_readings   who is connected, and who was refused before the application
"""
