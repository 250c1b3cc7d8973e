"""The periodic grid: transforms, processes that share it, kernels. No contact mechanics."""
