"""The command line.

console             standard output and standard error
verdict_lines       GO or NO-GO, and findings
fitted_tables       tables that leave out columns where it is narrow
flown_lines         what flying a plan has found, in a line
state_tables        tables of states that are no poses
stress_tables       what worse worlds do to a plan's filter
terminal_tables     tables of plans and runs for people
replay_tables       tables of replays
site_tables         tables of landmark sites
document_table      kinds of documents, their schemas and how reports are known
arguments           what commands take, and options of runs as parameters
required_verdicts   --require-go, --require-observable, --require-robust
plan_commands       plan, refine, place, landmarks
loss_tables         tables of losses
run_commands        validate, sweep
flight_commands     the command that flies plans
flight_tables       flights as tables
loss_commands       what-if
replay_commands     replay
plot_commands       plot
export_commands     export
service_commands    serve, worker
command_line        all commands, and exit statuses
"""
