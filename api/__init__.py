"""The service: plans, refinements and validations over HTTP, with jobs that survive.

Thin over syncplan, which does all the numbers. Modules, each using only those before it:

    keys, settings                     what an operator can set
    logs, problems.*, metrics.*        JSON lines, RFC 9457 documents, Prometheus
    negotiation, security, telemetry   media types, who asks, OpenTelemetry
    job_spans                          traces of jobs
    limits, plan_texts                 the most a request may ask for; scenarios and plans as sent
    job_kinds.*                        one table of job kinds: requests, tasks, results
    computing.*                        the numbers, in child processes
    storage.*                          plans, jobs, answers given: SQLite or PostgreSQL
    jobs.*                             durable workflows, heartbeats, what dead processes left
    watching.*                         what a scrape of the metrics reads of all these
    responses, service, idempotency    what responses hold, what routes work with
    page_tables, assets, routes.*      the page's tables and files, the routes
    operations, openapi                what the OpenAPI document adds to the routes
    application, main, worker_app      an application without routes; the service's, a worker's
    protocol, server                   HTTP below it, serving both

A request is read, checked and computed in a child process, so that nothing ever holds up the
event loop; a job is a row in the database and a durable workflow, entered in one transaction.
"""
