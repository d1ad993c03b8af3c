"""Scenarios, read and checked: vehicles, sensors, formation, areas, options.

quantities           numbers with units and limits, sections, faults in one line each
objectives           figures of merit, and those that a refinement can improve
altitudes            altitudes of vehicles, and the range that a difference of them leaves
areas                polygons that circles stay within or clear of
formations           shapes by name, their centres and neighbours
models               the sections of a scenario: circles, formation, sensor, limits, refinement
rules                conditions between keys that JSON Schema cannot state
filters              the table of filters to choose from
disturbances         disturbances of vehicles and readings, errors that the filter estimates
truths               keys of the simulated world that replace the scenario's own
purposes             what circles are flown for, and how far they serve it
angle_sigmas         standard deviations of angles that a scenario states
specification        the scenario as a whole
dotted_keys          every key that holds a number, and those that a sweep may vary
other_documents      documents that are neither scenarios nor plans
bounded_yaml         YAML in time proportional to its length
brief                what a design is for: field, vehicles, purpose, and the error allowed
loading              scenarios from YAML and JSON, and files with further landmarks
"""
