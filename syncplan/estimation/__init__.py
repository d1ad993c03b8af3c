"""How well: error bounds, the filter, many trials of it, and recordings of real robots.

covariances        covariance along a run, referred to time 0
bounds             Cramer-Rao bounds
reference_filter   the filter in plain NumPy, one trial
batched_filter     the same compiled, many trials at a time
consistency        ANEES, NIS, coverage
trials             what trials leave behind
montecarlo         many trials along a plan
trial_archive      trials as bytes
mrclam             recordings in the format of the MRCLAM data sets
replays            the filter on a recording
"""
