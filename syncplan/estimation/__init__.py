"""Estimation: error bounds, filters, Monte Carlo trials, and recordings of real robots.

referred_run       a run's noise and sighting rows, referred to time 0
covariances        covariance along a run, referred to time 0, and just before sightings
start_up_index     nonlinearity of the sightings at the start
referred_system    a team's run, referred to time 0, and its posterior bound
considered_errors  expected errors of a filter whose model differs from the world
lumped_bound       the posterior bound of large teams
bounds             Cramer-Rao bounds
filter_options     choice of filter, its gate, number and length of trials
consistency        ANEES, NIS, coverage
filter_setup       states, motion model, initial variances, gate, sightings and readings of a run
start_search       search for batch solutions: tempering, credibility, further starts
kernels            compilation of functions, and the lanes they run over
air_kernels        processes and motion in moving air, compiled
motion_kernels     prediction, and the frame of the covariance
correction_kernels  correction by sightings
statistics_kernels  comparison of lanes with the truth
lane_filter        the extended and the ideal filter, many trials side by side
batch_problem      the least-squares problem of a window, and the cost of a trajectory
batch_linearisation  a linear filter along trajectories
batch_solution     the most likely trajectory over a window
rivals             two estimates of a trial on the same later sightings
robust_filter      the filter that finds its start, and recovers when it is lost
online_filter      a filter one step at a time
trials             results of trials, whole and in parts
divided_runs       runs whose trials can be computed in parts
drawn_errors       lasting errors of trials
trial_readings     readings of trials
montecarlo         many trials along a plan
replay_settings    settings of a replay
recorded_readings  a recording's readings at their own times
recorded_run       a recording as a run of the filter
recorded_observability  times at which a recording's sightings determined all poses
withheld_sightings  prediction of sightings withheld from the filter, to compare settings
replay_tuning      sigmas and delay fitted to a recording's sightings, used if they predict better
replay_results     results of a replay
replays            the filter on a recording
"""
