"""Recordings of real robots, read from the common layouts.

log                content of a recording, its overview and its bytes; named robots and landmarks
recorded_files     files of a recording, limits of what is read, zip and tar archives
mrclam             folders in the layout of the MRCLAM data sets
csv_layout         folders of CSV files with a header
ros_bags           ROS 2 bags with the topics of a recording
recording_formats  the table of layouts, and the recording in a folder
"""
