"""Choice of landmark sites among candidates.

site_information   information that each site would add
site_search        the convex relaxation and its bound, rounding, swaps, proof
site_choice        the user's candidates, and the choice with its judged plan
"""
