"""What forces say, whoever found them. Stands on contacts."""
