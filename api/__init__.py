"""HTTP service for plans, refinements, validations and flights, with durable jobs.

A thin layer over syncplan, which does all the computation. Each module uses only those before it:

    keys, settings          API keys, settings of an operator
    logs                    JSON lines
    problems, failures      RFC 9457 documents; from exceptions to problems
    metrics, answering      Prometheus; middleware that answers, logs and counts every request
    security, telemetry     access control; OpenTelemetry
    limits, documents       limits on requests; scenarios, plans and recordings as sent
    job_kinds.*             one table of job kinds: studies and their requests
    computing.*             computation in child processes
    storage.*               plans, jobs and saved answers, in SQLite or PostgreSQL
    jobs.*                  durable workflows, heartbeats, recovery after dead processes
    connections, readings   connections and their limits; readings for a scrape of the metrics
    following               event streams: one reader of the database for all
    responses, service      models of responses, objects shared by the routes
    calls                   requests that wait for a task; idempotent answers
    routes.*, openapi       the routes, and additions to their OpenAPI document
    main                    the applications of the service and of a worker
    protocol, server        HTTP below the application; accepting connections, serving
    processes               several servers on one socket

A request is read, checked and computed in a child process, so that nothing ever blocks the event
loop. A job is a row in the database and a durable workflow, entered in one transaction.
"""
