"""A client of the service: requests, repeated while it is unavailable, and typed answers.

connection       requests and their errors
service_client   plans, recordings and jobs of a service
"""
