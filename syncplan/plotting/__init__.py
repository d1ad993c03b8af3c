"""The figures, one module each: what they draw, as plain values that Plotly understands.

palette              colours that everyone can tell apart, in light and dark
figure_style         size, scale of text and theme of a figure
canvas               axes, layouts and numbers that figures share
layout_fitting       a figure's frame fitted to its width: lines, legend, margins, height
link_styles          how links are drawn
link_lines           where links are drawn: from rim to rim
map_subject          what maps are drawn of
map_view             what a map shows, and its scale
map_labels           names on maps, clear of links and rims
map_layers           layers of maps: areas, circles, vehicles
panels_over_time     axes of panels that share an axis of time
event_marks          events of flights on axes of time
flight_panels        figures of flights over time, a panel a vehicle
figure_table         the table of figures; it names the module of each
catalogue            the figures of a plan or report, drawn
html_page            a page of figures that works offline
images               figures as PNG, SVG and PDF
plotly_figures       figures as Plotly's own objects: syncplan.figures
"""
