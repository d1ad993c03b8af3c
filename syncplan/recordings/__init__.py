"""What real robots recorded, read from the layouts that people keep it in.

log                what a recording holds
recorded_files     files of a recording, and limits of what is read
mrclam             folders in the layout of the MRCLAM data sets
recording_formats  the table of layouts, and the recording in a folder
"""
