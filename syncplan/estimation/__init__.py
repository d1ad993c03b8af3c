"""How well: error bounds, the filter, many trials of it, and recordings of real robots.

referred_run       noise and rows of a run, referred to time 0
covariances        covariance along a run, referred to time 0, and just before sightings
start_up_index     how far sightings are from linear at the start
referred_system    a team's run, referred to time 0, and its posterior bound
considered_errors  what errors cost that the filter does not estimate
bounds             Cramer-Rao bounds
covariance_kernel  covariance along a run, compiled
filter_options     which filter, its gate, how many trials of what length
consistency        ANEES, NIS, coverage
filter_setup       states, motion model, initial variances, gate, sightings and readings of a run
start_search       how batch solutions are searched for
pilot_readings     what a few trials read, samples thinned out
pilot_model        their arcs, and rows of their sightings
pilot              errors of a filter from a few such trials
reference_filter   the filter in plain NumPy, one trial, to read
kernels            how compiled functions are compiled, and their lanes
motion_kernels     prediction, and the frame that the covariance is in
correction_kernels  correction by sightings
statistics_kernels  comparison of lanes with the truth
lane_filter        the extended and the ideal filter, many trials side by side
batch_problem      the least-squares problem of a window, and what a trajectory costs
batch_linearisation  a linear filter along trajectories
batch_solution     the most likely trajectory over a window
rivals             two estimates of a trial on the same later sightings
robust_filter      the filter that finds its start, and itself where it is lost
online_filter      a filter one step at a time
trials             results of trials, whole and in parts
drawn_errors       lasting errors of trials
trial_readings     what is read in trials
montecarlo         many trials along a plan
replay_settings    what the filter assumes of a recording
recorded_readings  a recording's readings at their own times
recorded_run       a recording as a run of the filter
recorded_observability  when a recording's sightings determined all poses
withheld_sightings  how well settings predict sightings that the filter is not given
replay_tuning      sigmas and delay from a recording's sightings, and whether they are worth it
replay_results     what a replay found
replays            the filter on a recording
"""
