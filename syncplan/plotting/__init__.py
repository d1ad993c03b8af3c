"""Figures of plans and runs, as plain values that Plotly understands.

figure_style         size, text scale and colours of a figure
canvas               axes, layouts and numbers that figures share; fitting a layout to its width
links                appearance and position of links
maps                 extent and layers of maps
map_labels           names on maps, clear of links and rims
panels               panels of curves over time
series_figures       runs over time: errors, estimates, further states
flight_figures       flights: errors and phases over time, events, meetings, separation
flight_tracks_figure tracks of a flight over its plan
study_figures        losses, worse worlds, sweeps
formation_figures    the formation, still and animated
contact_figures      the timeline of contacts, and singular values
accuracy_figures     errors vehicle by vehicle, and consistency
comparison_figure    two plans, and a refinement
figure_table         the table of figures, with the module of each
figures              the figures of a subject, also as Plotly objects: syncplan.figures
figure_files         a page of figures that works offline (figure_page.css, .js), and images
"""
