"""Pages: a report as one HTML file that opens anywhere, with nothing fetched.

`drawing` makes of a scene and its report what is drawn, `page_file` puts it into the template in ``viewer/``. Reads
scenes and results only; nothing of it is imported where no page is asked for.
"""
