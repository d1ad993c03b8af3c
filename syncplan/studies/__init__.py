"""Studies: what can be asked of a plan, a scenario, a recording or a brief.

study         the common form of studies, and of those that consist of independent trials
validations   Monte Carlo runs of the filter
flights       flights in closed loop
refinements   the best plan near a plan
sweeps        one key of a scenario varied
replays       the filter on recordings of real robots
designs       the cheapest team that meets a brief
study_table   all studies by name
job_contract  kinds and states of jobs
"""
