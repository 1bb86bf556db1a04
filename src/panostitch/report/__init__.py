"""The report of a run: one HTML file that shows what became of the photos, and why.

`Record` listens to the stages, `write_report` makes the page. No stage knows of either.
"""

from panostitch.report.beside import Beside, Panorama, Table
from panostitch.report.record import Record
from panostitch.report.write import check_installed, write_report

__all__ = ["Beside", "Panorama", "Record", "Table", "check_installed", "write_report"]
