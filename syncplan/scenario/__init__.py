"""What the user states, read and checked: vehicles, sensors, formation, areas, options.

quantities           numbers with units and limits, sections, faults in one line each
objectives           figures of merit, and what a refinement can improve
areas                polygons that circles stay within or clear of
formations           shapes by name, their centres and neighbours
models               the sections of a scenario: circles, formation, sensor, limits, refinement
rules                conditions between keys that JSON Schema cannot state
filters              the table of filters to choose from
disturbances         what disturbs vehicles and readings, what of it the filter estimates
truths               what the simulated world has in place of the scenario's own
specification        the scenario as a whole
dotted_keys          every key that holds a number, and those that a sweep may vary
other_documents      what is neither scenario nor plan, by its name
bounded_yaml         YAML in time proportional to its length
loading              YAML and JSON to scenarios, and files with further landmarks
"""
