"""Choice of landmark sites: what each would tell, the relaxation's bound, the search."""
