"""Streams of events: one reader of the database for all who follow jobs.

job_watch      the reader, and what it found last of every job that is followed
followed_job   one job with those who follow it
event_stream   the answer that sends events as they happen
"""
