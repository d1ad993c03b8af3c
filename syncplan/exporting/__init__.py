"""Export of plans to files of other programs; a format is a function and a line of one table.

format_table      the table of formats, and the options of an export
exported_files    files in memory, in a folder or in an archive, and their names
scheduled_plan    a plan as it is flown: altitudes, duration, poses, positions on Earth
mission_routes    missions of loiter turns and of waypoints
missions          missions as QGroundControl and ArduPilot read them
map_files         GeoJSON and KML
trajectories      poses, ROS 2 bags, Crazyswarm2's polynomials
sidecar           JSON for what other files can't hold, and how vehicles join their circles
formats           the export of a plan in any format
"""
