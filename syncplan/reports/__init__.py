"""Plans and runs as JSON documents, with what their figures mean in words.

schemas             models of the documents
refinement_report   refinements
plan_report         plans
sites_report        choices of landmark sites
validation_report   validations and sweeps
replay_report       replays
"""
