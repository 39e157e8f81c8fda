"""The site of published results: static pages that open from a folder, without a network.

`write.write_site` makes it. The ranking on its first page is made in the reader's browser from rows
that come with the page, by the same statistics as everywhere else (`assets/statistics.js`); all
sentences and all other tables are those of the reports.
"""
