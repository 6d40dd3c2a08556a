"""Networks as ONNX files: written from a checkpoint (`export`), read and run by ONNX Runtime (`session`)."""
