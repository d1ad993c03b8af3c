"""The documentation: pages, and in `site` what is made when they are built."""
