"""The service: the planner over REST, with jobs that survive the process that runs them.

Nothing numeric lives here: every figure comes from `syncplan`. Modules, in the order of imports:

keys          API keys as an operator lists them
settings      what an operator can set, all of it by SYNCPLAN_* variables
logs          JSON lines on standard error, one for each request, tied by a request id
problems      errors as RFC 9457 documents: one table from exceptions to statuses
security      API keys and their owners; where the service may listen
metrics       counts and times for Prometheus
negotiation   what a client accepts (406) and sends (415)
telemetry     OpenTelemetry through FastAPI's own support
"""
