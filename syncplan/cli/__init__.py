"""The command line.

console             standard output and standard error
fitted_tables       tables that leave out columns on narrow terminals
plan_tables         plans, placements, landmark sites and losses as tables
run_tables          validations, sweeps, flights and replays as tables
document_table      kinds of documents, their schemas, and how reports are recognised
arguments           arguments that commands share, and options of runs as parameters
plan_commands       plan, refine, place, landmarks, what-if
run_commands        validate, sweep, fly, replay
plot_commands       plot
export_commands     export
service_commands    serve, worker
command_line        all commands, and exit statuses
"""
