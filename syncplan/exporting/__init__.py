"""Exports: plans as other programs' files, each format a function and a line of one table.

format_table      the table of formats, and what an export may be asked for
exported_files    files in memory, in a folder or in an archive, and their names
scheduled_plan    a plan as it is flown: height, length, poses, places on Earth
mission_routes    missions of loiter turns and of waypoints
missions          missions as QGroundControl and ArduPilot read them
map_files         GeoJSON and KML
trajectories      poses, ROS 2 bags, Crazyswarm2's polynomials
sidecar           what files can't say: the JSON contract, and how vehicles join their circles
formats           the export of a plan in any format
"""
