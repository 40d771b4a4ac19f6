"""The documentation as it is shipped: pages of app/docs made readable without a network; lists made from the code."""
