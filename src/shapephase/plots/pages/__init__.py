"""Pages that open offline: data packed by Python, shown by small scripts of `static/`.

A page is a template of `templates/` (Jinja2, autoescaping) with styles and scripts written into it, one compressed
block of arrays, and a content security policy that knows the scripts and styles by their hashes and lets nothing out.
"""
