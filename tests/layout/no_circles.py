"""A contract for import-linter: no file imports itself by way of others."""

from graphlib import CycleError, TopologicalSorter

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, output


class NoCircles(Contract):
    """Files, not packages: a package may stand on both sides of another."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
        try:
            TopologicalSorter(imports).prepare()
        except CycleError as error:
            return ContractCheck(kept=False, metadata={"circle": error.args[1]})
        return ContractCheck(kept=True)

    def render_broken_contract(self, check: ContractCheck) -> None:
        output.print_error("Each of these imports the one before it:")
        for name in check.metadata["circle"]:
            output.indent_cursor()
            output.print_error(name)
