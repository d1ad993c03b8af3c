"""Several HTTP processes on one socket, for more requests than one event loop can serve.

supervisor   starts them, starts those again that end, collects their metrics; serves nothing itself
member       one of them: the application on the shared socket, and its link to the supervisor

    supervisor --- listening socket, settings, share ---> member 0, with the embedded worker
        |                                                 member 1
        +---- asks for samples, answers scrapes ------->  ...
"""
