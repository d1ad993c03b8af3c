"""Whether the sightings determine every position and heading, why, and what is lost if not.

referred_rows        how each sighting changes with the state at time 0
rank                 rank and certificate of one window, link by link
loss_ranks           losses that end observability
unobservable_modes   null vectors named, with a cure
error_modes          rank with bias states beside the poses, its null vectors named
sliding_windows      the shortest window that certifies the team; windows along recorded paths
link_verdicts        each link: when it meets, its rank, why it falls short
"""
