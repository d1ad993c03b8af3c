"""What real robots recorded, read from the layouts that people keep it in.

log                what a recording holds, in short, and as bytes; robots and landmarks with names
recorded_files     files of a recording, limits of what is read, zip and tar archives
mrclam             folders in the layout of the MRCLAM data sets
csv_layout         folders of CSV files with a header
ros_bags           ROS 2 bags with the topics of a recording
recording_formats  the table of layouts, and the recording in a folder
"""
