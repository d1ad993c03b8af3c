"""Whether the sightings determine every position and heading, why, and what is lost if not.

referred_rows        how each sighting changes with the state at time 0
singular_values      rank, gap and null space of a matrix
rank                 of the windowed matrix, link by link
certificate          the corrected theorem, with its witness
window_assessment    windows, sightings, rank and certificate of one window
loss_ranks           losses that end observability
extended_rank        rank with errors that last as states
unobservable_modes   null vectors named, with a cure
error_modes          null vectors of errors named, and the verdict on them
sliding_windows      rank and certificate along any paths, such as recorded ones
connectivity         the shortest window that certifies the team
link_verdicts        each link: when it meets, its rank, why it falls short
"""
