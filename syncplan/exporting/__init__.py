"""Exports: plans as other programs' files, each format a module and a line of one table.

autopilots        autopilots and kinds of vehicles
export_options    what an export may be asked for
exported_files    files in memory, in a folder or in an archive
format_table      the table of formats; it names the module of each
geodesy           the plane on Earth
safe_names        names that any file system and ROS take
scheduled_plan    a plan as it is flown: height, length, poses
mission_items     items of autopilots' missions
loiter_turns      missions of loiter turns
polygons          missions of waypoints
missions          the missions of all vehicles
map_tracks        circles and tracks as maps show them
joining           how vehicles join their circles
sync_document     the JSON contract of the sidecar
sidecar           the sidecar
formats           the export of a plan in any format
"""
