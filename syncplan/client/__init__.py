"""A client of the service: requests, repeated while it is away, and its answers as types.

connection       requests and the errors they mean
service_client   plans, recordings and jobs of a service
"""
