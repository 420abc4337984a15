const JITTER = true;
