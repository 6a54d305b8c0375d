"""Steps of the build that are this site's own."""
