"""Pages of runs: static, from a folder, without a network.

`write.write_report_pages` makes those of one run, `write.write_site` those of all published ones;
they are the same pages. The ranking on the first one is made in the reader's browser, from rows
that come with it, so that filters make means and mean ranks anew; sentences, intervals, tests and
all other tables are those of the reports.
"""
