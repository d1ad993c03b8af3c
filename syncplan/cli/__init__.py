"""The command line.

console             standard output and standard error
fitted_tables       stories at a terminal, whose tables leave out columns where it is narrow
document_table      kinds of documents, their schemas, and how reports are recognised
arguments           arguments that commands share, and options of runs as parameters
requirements        verdicts that commands can require
plan_commands       plan, refine, place, landmarks, what-if
run_commands        validate, sweep, fly, replay
plot_commands       plot
export_commands     export
service_commands    serve, worker
command_line        all commands, and exit statuses
"""
