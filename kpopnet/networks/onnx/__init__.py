"""Networks as ONNX files: written from a checkpoint (`export`), read and checked (`file`), run by ONNX Runtime (`session`)."""
