"""What is asked about the product, not part of it: campaigns, benchmarks, costs, the paper."""
