"""What the user states, read and checked: vehicles, sensors, formation, areas, options.

faults               what is wrong with a file, each fault in one line
chunked_validation   long lists checked in chunks
quantities           numbers with units and limits
georeference         where [0, 0] lies on Earth
objectives           what a refinement can improve
refine_options       what a refinement may change, and to what end
areas                polygons that circles stay within or clear of
rules                conditions between keys that JSON Schema cannot state
polygon_rules        conditions on areas and obstacles
models               the sections of a scenario: circles, formation, sensor
disturbances         what disturbs vehicles and readings, what of it the filter estimates
truths               what the simulated world has in place of the scenario's own
formations           shapes by name, their centres and neighbours
specification        the scenario as a whole
dotted_keys          every key that holds a number: unit, limits, words
other_documents      what is neither scenario nor plan, by its name
bounded_yaml         YAML in time proportional to its length
loading              YAML and JSON to scenarios
landmark_edits       scenario files with further landmarks
"""
