"""The formats that results are exported in, listed without loading what writes them."""

from __future__ import annotations

from flows.command.exit_code import DONE
from flows.command.screen_table import screen, screen_table
from tasks.settings.deliver import EXCHANGE_OFFERS, OFFERS


def list_formats() -> int:
    """List all formats and what they are for."""
    console = screen()
    deliveries = {name: offer for name, offer in OFFERS.items() if name not in EXCHANGE_OFFERS}
    for title, offers in (("Block exchange", EXCHANGE_OFFERS), ("Result delivery", deliveries)):
        table = screen_table("format", "what", "usual kind", title=title)
        for name, offer in offers.items():
            table.add_row(name, offer.meaning, offer.worlds[0])
        console.print(table)
    console.print("Write one with: aerocal export RESULTS --to FORMAT")
    console.print("Exchange a block without adjusting it: aerocal convert PROJECT.toml --to FORMAT")
    return DONE
