"""The service: plans, refinements, validations and flights over HTTP, with jobs that survive.

Thin over syncplan, which does all the numbers. Modules, each using only those before it:

    addresses, keys, key_file          which clients are one, keys as an operator lists them
    database_addresses                 where plans and jobs are kept, as an operator writes it
    settings                           what an operator can set
    shares                             one of several HTTP processes: its part of the limits
    seldom_logs, security_headers      few lines for many cases; what every answer carries
    logs, problems.*, metrics.*        JSON lines, RFC 9457 documents, Prometheus
    negotiation, telemetry             media types, OpenTelemetry
    job_spans                          traces of jobs
    hosts, key_throttle, security      whose pages may ask, wrong keys, who asks
    limits, plan_texts                 the most a request may ask for; scenarios and plans as sent
    job_kinds.*                        one table of job kinds: requests, tasks, results
    computing.*                        the numbers, in child processes
    storage.*                          plans, jobs, answers given: SQLite or PostgreSQL
    jobs.*                             durable workflows, heartbeats, what dead processes left
    connections, descriptors           who is connected and for how long; open files
    watching.*                         what a scrape of the metrics reads of all these
    following.*                        streams of events: one reader of the database for all
    packed_recordings                  recordings as sent and as stored
    responses, uploads, service        what responses hold, what routes work with
    callers, idempotency               who waits for what is computed; the same answer twice
    page_tables, assets, routes.*      the page's tables and files, the routes
    operations, openapi                what the OpenAPI document adds to the routes
    application, main, worker_app      an application without routes; the service's, a worker's
    refusals, protocol, accepting      HTTP below the application, taking connections
    server                             serving it all
    processes.*                        several servers on one socket

A request is read, checked and computed in a child process, so that nothing ever holds up the
event loop; a job is a row in the database and a durable workflow, entered in one transaction.
"""
