"""Pages: a report as a single HTML file for any browser, with nothing fetched.

`drawing` makes the drawn data of a scene and its report, `page_file` puts the data into the template in ``viewer/``.
The room reads scenes and results only, and is imported by commands for pages alone.
"""
