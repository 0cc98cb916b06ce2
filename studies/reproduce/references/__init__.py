"""Reference studies on data of others: public benchmarks, with published figures beside ours."""
