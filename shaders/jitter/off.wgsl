const JITTER = false;
