"""The service: plans, refinements, validations and flights over HTTP, with jobs that survive.

Thin over syncplan, which does all the numbers. Modules, each using only those before it:

    keys, settings          keys as an operator lists them, what an operator can set
    logs                    JSON lines
    problems, failures      RFC 9457 documents; from exceptions to problems
    metrics, answering      Prometheus; every request answered, logged and counted
    security, telemetry     who may ask; OpenTelemetry
    limits, documents       the most a request may ask for; scenarios, plans, recordings as sent
    job_kinds.*             one table of job kinds: requests, tasks, results
    computing.*             the numbers, in child processes
    storage.*               plans, jobs, answers given: SQLite or PostgreSQL
    jobs.*                  durable workflows, heartbeats, what dead processes left
    connections, readings   who is connected; what a scrape of the metrics reads
    following               streams of events: one reader of the database for all
    responses, service      what responses hold, what routes work with
    calls                   who waits for what is computed; the same answer twice
    routes.*, openapi       the routes, and what their document adds
    main                    the applications of the service and of a worker
    protocol, server        HTTP below the application, connections, serving it all
    processes               several servers on one socket

A request is read, checked and computed in a child process, so that nothing ever holds up the
event loop; a job is a row in the database and a durable workflow, entered in one transaction.
"""
