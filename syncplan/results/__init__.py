"""Results: what the functions of syncplan return, and how terminals, notebooks and pages show them.

quantities   what tables show of a field, declared where the field is
stories      the lines and tables that present a result, as HTML and as rows of data frames
result       the base class of results
"""
