"""Observability: whether sightings determine every position and heading, and why.

referred_rows        rows of sightings, referred to the state at time 0
multifrontal         QR of large teams' rows, over a dissection by position
spectrum             rank, null space and variances of rows, dense or sparse
rank                 rank and certificate of one window, link by link
loss_ranks           losses that end observability
unobservable_modes   named null vectors, with a cure
error_modes          rank with bias states as well as poses, its null vectors named
sliding_windows      the shortest window that certifies the team; windows along recorded paths
link_verdicts        contact and rank of each link, with the reason for a low rank
"""
