"""The paper's figures and claims, judged on stored results and put into one report."""
