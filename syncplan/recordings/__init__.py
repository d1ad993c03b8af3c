"""What real robots recorded, read from the layouts that people keep it in.

log                what a recording holds
recorded_files     files of a recording, and limits of what is read
mrclam             folders in the layout of the MRCLAM data sets
named_teams        robots and landmarks with names
csv_tables         CSV files with a header
csv_layout         folders of such files
ros_messages       ROS 2 messages, and what is taken from each
ros_bags           ROS 2 bags, topic by topic
bag_layout         bags with the topics of a recording
archives           zip and tar archives of recordings
packed_logs        recordings as bytes
overviews          recordings in short
recording_formats  the table of layouts, and the recording in a folder
"""
