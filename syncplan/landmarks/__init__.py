"""Which of several candidate sites landmarks should be set at.

candidates         sites as the user gives them
site_information   what each site would add
site_relaxation    the convex relaxation and its bound
site_search        rounding, swaps, proof
site_choice        the choice, judged
"""
