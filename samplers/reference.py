"""What a method is cited by: one entry, in words and as BibTeX."""

import unicodedata
from dataclasses import dataclass

VENUE_FIELD = {
    "article": "journal", "inproceedings": "booktitle", "techreport": "institution",
    "book": "publisher", "misc": "howpublished",
}  # fmt: skip
"""What BibTeX calls the venue, by the kind of entry."""


@dataclass(frozen=True)
class Reference:
    """A publication, or a program where nothing is published.

    authors : names in full with commas between, the family name last; a group is one word
    venue : journal, conference, institution or publisher
    kind : BibTeX's, one of `VENUE_FIELD`
    volume : with the issue, as "44(1)"; of a report its number
    doi : without an address before it; none where none exists
    """

    authors: str
    title: str
    venue: str
    year: int
    kind: str = "inproceedings"
    volume: str = ""
    doi: str = ""
    url: str = ""

    @property
    def short(self) -> str:
        """As labels have it: "Wu 2025"."""
        return f"{self.authors.split(', ')[0].split()[-1]} {self.year}"

    @property
    def key(self) -> str:
        """What BibTeX cites it by: "wu2025", in plain letters."""
        plain = unicodedata.normalize("NFKD", self.short).encode("ascii", "ignore").decode()
        return "".join(filter(str.isalnum, plain)).lower()

    @property
    def words(self) -> str:
        """One line for a list of references."""
        where = " ".join(filter(None, [self.venue, self.volume]))
        found = f" doi:{self.doi}" if self.doi else f" {self.url}" if self.url else ""
        return f"{self.authors}: {self.title}. {where}, {self.year}.{found}"

    @property
    def bibtex(self) -> str:
        """The entry; braces keep the capitals of the title."""
        volume, _, issue = self.volume.removesuffix(")").partition("(")
        numbered = {"number": volume} if self.kind == "techreport" else {
            "volume": volume, "number": issue,
        }  # fmt: skip
        fields = {
            "author": self.authors.replace(", ", " and "), "title": f"{{{self.title}}}",
            VENUE_FIELD[self.kind]: self.venue, **numbered, "year": str(self.year),
            "doi": self.doi, "url": self.url,
        }  # fmt: skip
        lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
        return "\n".join([f"@{self.kind}{{{self.key},", *lines, "}"])
