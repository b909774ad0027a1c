"""A phone without a phone: a real adbd over a private root, with llvmpipe behind `app_process`."""
